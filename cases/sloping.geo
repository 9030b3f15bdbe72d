// Mesh of sloping.case; the differences stand there.
Include "sloping.case";
Include "../geo/window.geo";
