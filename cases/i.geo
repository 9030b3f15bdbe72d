// Mesh of i.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "i.case";
Include "../geo/window.geo";
