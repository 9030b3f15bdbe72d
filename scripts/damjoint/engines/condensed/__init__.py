"""The condensed engine: bodies condensed onto the joint once, then load steps on the joint only.

recover.py  displacement and stress of the bodies, from the displacement jump
solve.py    the interface to the rest
"""
