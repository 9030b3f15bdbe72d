// Mesh of d.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "d.case";
Include "../geo/window.geo";
