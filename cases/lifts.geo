// Mesh of lifts.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "lifts.case";
Include "../geo/window.geo";
