// Mesh of dam.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "dam.case";
Include "../geo/window.geo";
