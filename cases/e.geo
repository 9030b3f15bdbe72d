// Mesh of e.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "e.case";
Include "../geo/window.geo";
