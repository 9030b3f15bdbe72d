// Mesh of koyna.case, which lists what differs from the defaults.
Include "../pro/units.pro";
Include "koyna.case";
Include "../geo/window.geo";
