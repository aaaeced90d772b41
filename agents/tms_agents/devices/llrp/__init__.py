"""UHF readers that speak EPCglobal LLRP 1.0.1 / 1.1 (TCP port 5084)."""
