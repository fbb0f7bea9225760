"""A few maps in place of one per frame: redirection = identity + sum of weights times basis maps."""
