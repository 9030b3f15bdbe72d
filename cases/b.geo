// Mesh of b.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "b.case";
Include "../geo/window.geo";
