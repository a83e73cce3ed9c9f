"""LIGGGHTS deck templates (Jinja2): text only, every number is computed in fdnet."""
