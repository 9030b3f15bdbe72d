// Mesh of f.case; the differences stand there.
Include "../pro/units.pro";
Include "f.case";
Include "../geo/window.geo";
