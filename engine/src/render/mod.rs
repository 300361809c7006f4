//! Rendering: a scene of splats or of a volume, seen through a transfer function.
