// valley_blocks.geo - the dam of valley.geo, divided into blocks by contraction joints every 15 m.
contraction_spacing = 15;
Include "valley.geo";
