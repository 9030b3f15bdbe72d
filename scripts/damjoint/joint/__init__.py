"""The joint between the condensed bodies: interpolation, wet faces, flow, residual and tangent."""
