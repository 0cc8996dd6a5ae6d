"""Who asks, what they may, and what they did.

roles      what there is to be allowed;  keys      who may it, shown by a secret of which a hash is kept
key_ring   the keys as they are now;     sessions  browsers that have shown one
access     all of it together: who asks?
entries    what somebody did;            book      all that was done, on disk in a moment
"""
