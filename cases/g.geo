// Mesh of g.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "g.case";
Include "../geo/window.geo";
