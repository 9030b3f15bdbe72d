"""What a user gives: case files, parameters, what follows from them, and its checks."""
