// Mesh of sloping.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "sloping.case";
Include "../geo/window.geo";
