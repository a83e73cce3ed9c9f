"""From a sand, a mud and a well to a case whose answer means something."""
