"""What is odd about a case, what follows, and what to do about it."""
