"""The condensed engine: bodies condensed onto the joint once, the loading followed there alone.

cache.py    condensed bodies on disk
recover.py  displacement and stress of the bodies, from the joint's jump
solve.py    the interface to the rest
"""
