// Mesh of c.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "c.case";
Include "../geo/window.geo";
