// Mesh of j.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "j.case";
Include "../geo/window.geo";
