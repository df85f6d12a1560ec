"""The models of racers: uploads, admission, sharing, downloads and exports."""
