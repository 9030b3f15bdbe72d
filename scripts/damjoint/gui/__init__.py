"""The Gmsh window: damjoint gui.

sheet.py    what a request from the window comes to: the case, and its ONELAB parameters
tree.py     the ONELAB tree: parameters, choices and results shown in it; what the user asks for
worker.py   the engine in a process of its own: checks, runs, stops, saves
shapes.py   the deformed scene as lines and faces, step by step
camera.py   how the scene lies in the window
views.py    results as Gmsh views: the deformed dam, curves, maps
window.py   one session: what happens when something is pressed or comes back; the event loop

Everything but the event loop works without a window, and is tested so.
"""
