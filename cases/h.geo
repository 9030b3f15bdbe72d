// Mesh of h.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "h.case";
Include "../geo/window.geo";
