// Mesh of f.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "f.case";
Include "../geo/window.geo";
