// Mesh of sloping.case; the differences stand there.
Include "../pro/units.pro";
Include "sloping.case";
Include "../geo/window.geo";
