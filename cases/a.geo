// Mesh of a.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "a.case";
Include "../geo/window.geo";
