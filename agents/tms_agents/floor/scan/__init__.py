"""What a scan shows and what it does not: beams, backgrounds, clusters, and what is free, taken or hidden."""
