"""What the chapter needs: a problem, its rows, least squares, essential parameters, CESTAC."""
