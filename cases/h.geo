// Mesh of h.case; the differences stand there.
Include "../pro/units.pro";
Include "h.case";
Include "../geo/window.geo";
