"""Points that a coordinate measuring machine reported, and where they truly were."""
