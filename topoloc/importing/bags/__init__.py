"""ROS 1 and ROS 2 bags become recordings, without ROS: the library ``rosbags`` reads their files."""

from topoloc.importing.bags.bag import Bag, Message, Topic
from topoloc.importing.bags.importer import BagImport, import_bag
from topoloc.importing.bags.job import BagSettings
from topoloc.importing.bags.topics import Told, use_of
from topoloc.importing.bags.tracks import transforms_in

__all__ = ["Bag", "BagImport", "BagSettings", "Message", "Told", "Topic", "import_bag", "transforms_in", "use_of"]
