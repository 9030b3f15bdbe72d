"""Independent verification of results: from the command line and the files of a run alone.

Nothing of `damjoint` is imported (a test), so that none of its errors is repeated: the values of
the joints are read from the command line again, loads, laws, water and elasticity are computed
again, slowly and plainly, from the formulas of reference/theory.md.

| module | what it checks, by what |
|---|---|
| `files` | reads the tables and run.json of a run |
| `reader` | the values of each joint, levels and times, from the command line |
| `statics` | weights and loads of the section's polygons: N + U, T, M of every step |
| `laws/`, `replay` | traction, damage, slip of every step at every node and integration point |
| `tables` | completeness of the tables, integrals over the joint, rows of the nodes |
| `solids` | reads the bodies' mesh; functions and quadrature on their sides |
| `joint_state` | a joint at a time: openings, heads at its ends, pressure by a head |
| `network` | heads of the water that flows in joints that meet |
| `water` | pressure and flux, from the openings |
| `finite_elements`, `body_loads` | bodies by scikit-fem; loads on their faces, lines and volume |
| `elasticity` | displacement jumps, from loads and tractions of the joints |
| `again` | independence of steps; critical values |
| `stops` | whether there is no equilibrium beyond the last state, by limit analysis |
| `water_in_time` | pressure of water that is stored, from the openings of all steps |
| `water_in_motion` | pressure in every time step of an earthquake, by `quake_uplift` |
| `earthquake` | balance of momentum and motion of every time step |
| `verify` | all of them, for the files of a run |

Each check is a generator of the rules that the files violate, in words.
"""
