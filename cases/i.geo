// Mesh of i.case; the differences stand there.
Include "../pro/units.pro";
Include "i.case";
Include "../geo/window.geo";
