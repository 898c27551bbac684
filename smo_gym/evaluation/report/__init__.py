"""What is told of a study: tables, the article's figures, and a page to look at it all."""
