// Mesh of dam.case; the differences stand there.
Include "dam.case";
Include "../geo/window.geo";
