"""The public Python API: what `import stickslip_ros as ss` offers, one module a subject."""
