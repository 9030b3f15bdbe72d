// Mesh of dam.case; the differences stand there.
Include "../pro/units.pro";
Include "dam.case";
Include "../geo/window.geo";
