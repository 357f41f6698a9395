"""What people read: the page of a refit and its figures, made from the refit itself and without any foreign host."""
