"""The Gmsh window: damjoint gui.

sheet.py    request of the user; the case it gives, with its ONELAB parameters
numbers.py  numbers of a run by step, beside the gravity method; a table of all levels
scene.py    solved scenes: the static loads, and an earthquake after them
worker.py   the engine in a process of its own: checks, runs, stops, saves
layout.py   places in the drawing area, in pixels; the size of the window
camera.py   view: clipping, rotation, position, scale
shapes.py   the deformed scene as lines, faces and labels, step by step
gallery.py  the views of a run: adding, stepping, removing; colors and texts
graphs.py   graphs with round ticks, a grid, curves
curves.py   the curves that are shown: along the joint, over the levels, over an earthquake
views.py    results as Gmsh views: the deformed dam, strips of a 3D joint, graphs, table
tree.py     the ONELAB tree: shows parameters and results, reads the request
export.py   picture and animation of the drawing area
window.py   session: actions of the user, messages of the engine; the event loop

Everything but the event loop works, and is tested, without a window.
"""
