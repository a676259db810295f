"""make live: a page in the browser at which somebody works with the virtual board, or watches a real one."""
