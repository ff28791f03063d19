"""rotorfault"""
