// Mesh of f.case; the differences stand there.
Include "f.case";
Include "../geo/window.geo";
