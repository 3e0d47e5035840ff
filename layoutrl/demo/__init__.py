"""A page on which rooms are furnished: a server on this machine that keeps nothing, and the page that it serves."""
