"""Maps, figures and the page of a campaign."""
