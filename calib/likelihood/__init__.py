"""The maximum-likelihood fit: everything at once, from a first solution, with its uncertainty.

    measurements         what was seen, as padded arrays a camera
    state                what moves: the chain, the cameras on it, their lenses; and the vector of small steps
    lens_terms           a pixel and its derivatives by point and lens
    chain_terms          each view's pose and its derivatives by every parameter and reading
    blocks               what each view says of its pose, lens and target
    problem              the likelihood: measurements, what is free, what is known beforehand
    beforehand           what is held, and what is known about
    building             a session as that likelihood;  idle  whether joints stand still that should
    normal               every view's information, mapped to the parameters
    descent              Levenberg and Marquardt's way down
    outliers             what does not belong
    noise                how noisy points and poses are;  scatter  what else scatters the views
    imperfections        what joints, target and sensor may be off by;  promises  what knowing it would gain
    selection            which of that the data support
    refinement           all of it in turn, until nothing changes
    uncertainty          the covariance;  document_covariance  in the document's own numbers
    quantities           what a person asks about;  weakness  what of it the views do not tell
    other_views          what other views would tell;  usual  of a rig whose lens is open
    held_out             how well each view is predicted by all others;  predicted_miss  how well it should be

A fit starts at `refinement.refine`.
"""
