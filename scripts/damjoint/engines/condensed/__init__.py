"""The condensed engine: static condensation of the bodies, then load steps on the joint only.

recover.py  displacement and stress of the bodies, from the displacement jump
solve.py    the interface of engines/__init__.py
"""
