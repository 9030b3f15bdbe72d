// Mesh of h.case; the differences stand there.
Include "h.case";
Include "../geo/window.geo";
