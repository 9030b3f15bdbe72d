"""The condensed engine: bodies eliminated once, the loading followed on the joint alone.

elements.py, elasticity.py  finite elements: functions, rules, stiffness, stress
factor.py                   factorisation of large sparse matrices
bulk.py, cache.py           both bodies eliminated, and kept on disk
faces.py                    what presses on the faces, exact in spite of the waterline
interface.py, flow.py       the joint's interpolations and linear systems; water that flows in it
laws.py                     the joint laws of pro/law_*.pro, many points at once
equilibrium.py, newton.py   residual and tangent; Newton's method
record.py, stepping.py      what is kept of a step; one step of a loading
path.py, filling.py         the equilibrium path beyond a level; all steps of a loading
recover.py                  the bodies' displacement and stress, from the joint's
solve.py                    the interface to the rest
"""
