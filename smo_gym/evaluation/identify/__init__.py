"""What the article does not print, recovered from what it does."""
