"""The paper reproduced: its cases, figures, table and claims, and what they are worth."""
