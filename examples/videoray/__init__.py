"""The VideoRay beside its paper: the figures whose data the paper prints."""
