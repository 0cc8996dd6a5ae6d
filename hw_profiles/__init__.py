"""One TOML file a rig, shipped with the package so that they can be named anywhere."""
