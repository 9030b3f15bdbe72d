"""The Gmsh window: damjoint gui.

sheet.py    request of the user; the case it gives, with its ONELAB parameters
tree.py     the ONELAB tree: shows parameters and results, reads the request
worker.py   the engine in a process of its own: checks, runs, stops, saves
shapes.py   the deformed scene as lines and faces, step by step
camera.py   view: clipping, rotation, position, scale
views.py    results as Gmsh views: the deformed dam, curves, maps
window.py   session: actions of the user, messages of the engine; the event loop

Everything but the event loop works, and is tested, without a window.
"""
