"""The maximum-likelihood fit: everything at once, from the closed form, with its uncertainty.

lens_terms     a pixel and its derivatives by point and lens
parameters     what is free: names, slices, and the state they move
chain_terms    each view's pose and its derivatives by every parameter
measurements   what was seen, as padded arrays a view
normal         a view's information about its pose and lens, mapped to the parameters
descent        Levenberg and Marquardt's method on these
"""
