"""What the tree of files promises, checked: names, words, folders, imports, and how few files an errand passes through."""
