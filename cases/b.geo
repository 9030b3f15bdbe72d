// Mesh of b.case; the differences stand there.
Include "b.case";
Include "../geo/window.geo";
