"""What a log can show: rates, quantisation, bands, copies."""
