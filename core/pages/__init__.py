"""What pages of several rooms share: slots and navigation, live parts, the nonce of a form."""
