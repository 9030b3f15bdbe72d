// Mesh of k.case; the differences stand there.
Include "../pro/units.pro";
Include "k.case";
Include "../geo/window.geo";
