// Mesh of a.case; the differences stand there.
Include "a.case";
Include "../geo/window.geo";
