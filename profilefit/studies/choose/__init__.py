"""The least model that a scene needs: what each way to scatter light costs there, and how wrong it will be."""
