"""Maps of rooms: versions made of tiles stored by content, pictures and ROS files of any version, differences."""
