// Mesh of k.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "k.case";
Include "../geo/window.geo";
